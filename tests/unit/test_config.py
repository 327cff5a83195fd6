"""The configuration: defaults, layers, and an error with a name for everything that is wrong."""

from __future__ import annotations

import copy
import json
import pickle
from dataclasses import asdict, fields, is_dataclass, replace

import numpy as np
import pytest
import yaml

from repair.config import Config, load_config, preset_names
from repair.config.load import recorded_config
from repair.config.schema import configuration_keys, values_of, words_of
from repair.errors import BackendError, ConfigError, RepairError
from repair.solvers.registry import backend_names

KEYS = {key.name: key for key in configuration_keys()}
WORDS = {name: words_of(key) for name, key in KEYS.items() if words_of(key)}
RANGES = {
    name: (key.setting.low, key.setting.high)
    for name, key in KEYS.items()
    if key.setting.low is not None or key.setting.high is not None
}


def value_of(config, key):
    for part in key.split("."):
        config = getattr(config, part)
    return config


def listed(value):
    return value if isinstance(value, list) else [value]


def test_defaults_are_the_dataclasses():
    assert load_config() == Config()
    assert isinstance(load_config(), Config)


def test_two_loads_share_nothing():
    first, second = load_config(), load_config()
    first.ego.deform.smooth = 77.0
    assert second.ego.deform.smooth != 77.0
    assert load_config() == Config()


def test_every_key_is_a_value_of_the_configuration_with_its_default_in_range():
    assert list(values_of(Config())) == list(KEYS)
    for name, key in KEYS.items():
        assert value_of(Config(), name) == key.default, name
        assert key.setting.says, f"{name} has no meaning"
    for name, words in WORDS.items():
        assert KEYS[name].default is None or set(listed(KEYS[name].default)) <= set(words), name
    for name, (low, high) in RANGES.items():
        default = KEYS[name].default
        assert default is None or all(low <= one <= high for one in listed(default)), name
        assert KEYS[name].type.split(" or ")[0] in ("int", "float", "list[float]"), name
    for key in KEYS.values():
        needed = key.setting.only_with
        assert needed is None or needed[0] in KEYS


def test_every_number_has_a_range():
    """But for ids, which may be any."""
    numbers = {name for name, key in KEYS.items() if set(key.type.split(" or ")) & {"int", "float"}}
    ids = {"scene.vehicle", "scene.planning_problem", "reference.obstacle_id"}
    assert numbers - set(RANGES) == ids
    assert all(low is not None and high is not None for low, high in RANGES.values())


@pytest.mark.thinned(4)
@pytest.mark.parametrize("key", sorted(WORDS))
def test_every_choice_is_accepted_and_another_word_refused(key):
    several = KEYS[key].type.startswith("list")
    for word in WORDS[key]:
        config = load_config(overrides=[f"{key}={[word] if several else word}"])
        assert listed(value_of(config, key)) == [word]
    with pytest.raises(ConfigError, match=f"'{key}'.*nonsense.*{WORDS[key][0]}"):
        load_config(overrides=[f"{key}={'[nonsense]' if several else 'nonsense'}"])
    if several:
        assert value_of(load_config(overrides={key: list(WORDS[key])}), key) == list(WORDS[key])
        with pytest.raises(ConfigError, match=f"'{key}'.*'nonsense' is unknown"):
            load_config(overrides={key: [WORDS[key][0], "nonsense"]})


@pytest.mark.thinned(5)
@pytest.mark.parametrize("key", sorted(RANGES))
def test_every_range_is_closed(key):
    low, high = RANGES[key]
    kind = int if KEYS[key].type.startswith("int") else float
    several = KEYS[key].type.startswith("list")
    for value in (low, high):
        shown = [float(value)] if several else kind(value)
        assert listed(value_of(load_config(overrides={key: shown}), key)) == [pytest.approx(value)]
    for value in (low - 1, high + 1):
        shown = [float(value)] if several else kind(value)
        with pytest.raises(ConfigError, match=f"'{key}'"):
            load_config(overrides={key: shown})


# -- overrides ---------------------------------------------------------------------------------------


def test_overrides_as_text_as_mapping_and_as_keys_are_the_same():
    text = load_config(overrides=["search.delta_t=0.1", "backend=casadi"])
    mapping = load_config(overrides={"search.delta_t": 0.1, "backend": "casadi"})
    keys = load_config(overrides=["search.delta_t=0.1"], backend="casadi")
    assert text == mapping == keys
    assert text.search.delta_t == 0.1


def test_null_takes_an_optional_value_away():
    assert load_config(preset="scenario_1", overrides=["repair.horizon=null"]).repair.horizon is None


def test_the_last_override_wins():
    assert load_config(overrides=["search.delta_t=0.1", "search.delta_t=0.2"]).search.delta_t == 0.2


@pytest.mark.parametrize("overrides", [["seed=1"], {"seed": 1}])
def test_the_seed_that_never_did_anything_is_no_key(overrides):
    with pytest.raises(ConfigError, match="no configuration key 'seed'"):
        load_config(overrides=overrides)


NUMPY = [
    ("search.delta_t", np.float64(0.25), 0.25),
    ("search.delta_t", np.float32(0.25), 0.25),
    ("search.delta_t", np.int64(2), 2.0),
    ("search.delta_t", np.array(0.25), 0.25),
    ("search.time_limit", np.float64(1.5), 1.5),
    ("repair.degree", np.int64(4), 4),
    ("scene.planning_problem", np.uint16(7), 7),
    ("scene.vehicle", np.int32(2), 2),
    ("reference.source", np.str_("constant"), "constant"),
    ("checker.margin", np.bool_(True), True),
    ("repair.relax", np.array([-0.1, -0.5]), [-0.1, -0.5]),
    ("repair.relax", [np.float64(-0.1)], [-0.1]),
    ("repair.relax", (np.float32(-0.5),), [-0.5]),
]


@pytest.mark.parametrize("key, given, value", NUMPY)
def test_numbers_of_numpy_are_numbers(key, given, value):
    config = load_config(overrides={key: given})
    assert value_of(config, key) == value
    assert type(value_of(config, key)) is type(value)
    section, _, last = key.partition(".")
    assert load_config(overrides={section: {last: given}}) == config
    assert load_config(**{section: {last: given}}) == config
    assert json.loads(json.dumps(config.to_dict())) == config.to_dict()


def test_numbers_of_numpy_are_checked_like_any_other():
    with pytest.raises(ConfigError, match=r"'search.delta_t' is -1.0; it must lie in"):
        load_config(overrides={"search.delta_t": np.float64(-1.0)})
    with pytest.raises(ConfigError, match=r"'search.delta_t'.*finite"):
        load_config(overrides={"search.delta_t": np.float64("nan")})
    with pytest.raises(ConfigError, match=r"'repair\.degree'"):
        load_config(overrides={"repair.degree": np.float64(3.5)})
    with pytest.raises(ConfigError, match=r"'search\.delta_t'"):
        load_config(overrides={"search.delta_t": np.array([0.1, 0.2])})


@pytest.mark.parametrize(
    "override, message",
    [
        ("serach.delta_t=0.1", "'serach"),
        ("search.detla_t=0.1", r"'search.detla_t'.*did you mean 'search.delta_t'"),
        ("ego.deform.colision=2", r"'ego.deform.colision'.*did you mean 'ego.deform.collision'"),
        ("search.delta_t=fast", "'search.delta_t'.*fast"),
        ("search.delta_t=null", "'search.delta_t'"),
        ("search.delta_t=-1", "'search.delta_t'.*-1"),
        ("search.delta_t=0", "'search.delta_t'"),
        ("search.delta_t=nan", "'search.delta_t'.*finite"),
        ("repair.ease=[0.1,2]", "'repair.ease'.*numbers from 0 to 0.9"),
        ("repair.widen=[-1]", "'repair.widen'.*numbers from 0 to 50"),
        ("repair.relax=[-60]", "'repair.relax'.*numbers from -50 to 50"),
        ("search.upper=inf", "'search.upper'.*finite"),
        ("repair.degree=3.5", "'repair.degree'"),
        ("repair.degree=2", "'repair.degree'"),
        ("ego.precondition=maybe", "'ego.precondition'"),
        ("search=3", "'search'"),
        ("search.delta_t.x=3", "search.delta_t"),
        ("backend=[1,2]", "backend"),
        ("driver={a: 1}", "driver"),
        ("limits.a_min=3", "'limits.a_min'"),
        ("search.delta_t", "key=value"),
        ("=3", "key=value"),
        ("", "key=value"),
        ("search.delta_t=${missing}", "search.delta_t"),
        ("search.delta_t=[", "overrides"),
    ],
)
def test_bad_overrides_name_their_key(override, message):
    with pytest.raises(ConfigError, match=message) as raised:
        load_config(overrides=[override])
    assert isinstance(raised.value, RepairError)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    "overrides, message",
    [
        ({"search.detla_t": 0.1}, "'search.detla_t'"),
        ({"search": 3}, "'search'"),
        ({"search.delta_t": [1]}, "search.delta_t"),
        ({"search.delta_t": object()}, "search.delta_t"),
        ({"nothing": 1}, "'nothing'"),
        ({3: 1}, "3"),
    ],
)
def test_bad_mappings_name_their_key(overrides, message):
    with pytest.raises(ConfigError, match=message):
        load_config(overrides=overrides)


def test_unknown_keyword_is_named():
    with pytest.raises(ConfigError, match="'beckend'"):
        load_config(beckend="ego")


# -- files -------------------------------------------------------------------------------------------


def write(folder, text):
    path = folder / "own.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_file_lies_over_the_preset_and_under_the_overrides(tmp_path):
    path = write(tmp_path, "search: {delta_t: 0.2, upper: 1.0}\nbackend: casadi\n")
    config = load_config(preset="scenario_1", file=path, overrides=["search.upper=1.5"])
    assert config.search.delta_t == 0.2
    assert config.search.upper == 1.5
    assert config.backend == "casadi"
    assert config.repair.lateral == "none"  # from the preset


@pytest.mark.parametrize(
    "text, message",
    [
        ("search: {detla_t: 0.2}\n", "own.yaml.*'search.detla_t'"),
        ("search: {delta_t: soon}\n", "own.yaml.*'search.delta_t'"),
        ("search.delta_t: 0.2\n", "own.yaml.*'search.delta_t'; write each part of the name as a mapping"),
        ("ego: {refine.fit: 0.2}\n", "own.yaml.*'ego.refine.fit'; write each part of the name as a mapping"),
        ("search: [1, 2]\n", "'search'"),
        ("search:\n", "'search' is empty"),
        ("ego: {deform: 3}\n", "'ego.deform' is 3"),
        ("for_backend: 3\n", "'for_backend' is 3"),
        ("3: 4\n", "own.yaml.*3"),
        ("- 1\n- 2\n", "mapping"),
        ("search: {delta_t: 0.2\n", "cannot be read"),
        ("just a word\n", "own.yaml"),
        ("search: {delta_t: 0.2}\nsearch: {delta_t: 0.3}\n", "own.yaml"),
    ],
)
def test_bad_files_are_named(tmp_path, text, message):
    with pytest.raises(ConfigError, match=message):
        load_config(file=write(tmp_path, text))


def test_empty_file_changes_nothing(tmp_path):
    assert load_config(file=write(tmp_path, "")) == Config()


def test_missing_file_and_folder_and_bytes_are_errors(tmp_path):
    with pytest.raises(ConfigError, match="does not exist"):
        load_config(file=tmp_path / "nowhere.yaml")
    with pytest.raises(ConfigError, match="cannot be read"):
        load_config(file=tmp_path)
    (tmp_path / "bytes.yaml").write_bytes(b"\xff\xfe\x00\x9f")
    with pytest.raises(ConfigError, match="cannot be read"):
        load_config(file=tmp_path / "bytes.yaml")


def test_round_trip_through_a_file(tmp_path):
    config = load_config(
        preset="scenario_1", backend="ego", overrides=["limits.a_min=-4.5", "search.time_limit=2"]
    )
    path = write(tmp_path, yaml.safe_dump(config.to_dict()))
    assert load_config(file=path) == config


@pytest.mark.parametrize("backend", ["ego", "casadi", "qptr"])
def test_what_a_result_records_is_the_configuration_again(backend):
    overrides = ["search.delta_t=0.1", "reference.source=constant", "reference.a_lat=0.9"]
    config = load_config(preset="scenario_1", backend=backend, overrides=overrides)
    record = json.loads(json.dumps({"config": config.to_dict(), "config_given": sorted(config.given)}))
    again = recorded_config(record)
    assert again == config
    assert again.given == config.given > set()
    old = recorded_config({"config": {**config.to_dict(), "seed": 3}})  # as earlier versions wrote it
    assert old == config
    assert old.given == set()
    assert recorded_config({"config": {"search": {"delta_t": 0.2}}}).search.delta_t == 0.2


@pytest.mark.parametrize(
    "values, message",
    [
        ({"temper": 1}, "no configuration key 'temper'"),
        ({"search": 3}, "'search' is 3"),
        ({"search": {"delta_t": -1}}, r"'search\.delta_t'"),
    ],
)
def test_a_record_that_is_none_is_named(values, message):
    with pytest.raises(ConfigError, match=message):
        recorded_config({"config": values})


def test_to_dict_holds_every_key_in_the_order_in_which_they_are_shown():
    def leaves(node, prefix=""):
        for name, value in node.items():
            if isinstance(value, dict) and prefix + name != "for_backend":
                yield from leaves(value, f"{prefix}{name}.")
            else:
                yield prefix + name

    assert list(leaves(load_config().to_dict())) == list(KEYS)


# -- presets -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", preset_names())
@pytest.mark.parametrize("backend", ["ego", "casadi", "qptr"])
def test_every_preset_resolves_for_every_backend(name, backend):
    config = load_config(preset=name, backend=backend)
    assert config.backend == backend
    assert config.for_backend == {}


def test_preset_of_scenario_1_has_the_printed_numbers():
    config = load_config(preset="scenario_1")
    assert (config.scene.s_offset, config.scene.l_offset) == (2.25, 2.0)
    assert config.search.delta_t == 0.4
    assert config.repair.clearance == 1.0
    assert asdict(config.ego.deform) == {"smooth": 1.0, "collision": 15.0, "feasible": 1.0}
    assert asdict(config.ego.refine) == {"smooth": 1.0, "feasible": 1.0, "fit": 0.01}
    assert (config.ego.max_iterations, config.ego.tolerance) == (100, 0.01)
    assert config.search.upper == 2.0


def test_unknown_preset_names_those_there_are():
    with pytest.raises(ConfigError, match=r"scenario_9.*scenario_1"):
        load_config(preset="scenario_9")


@pytest.mark.parametrize("name", ["../presets/scenario_1", "scenario_1.yaml", "", "SCENARIO_1"])
def test_presets_are_names_and_not_paths(name):
    with pytest.raises(ConfigError, match="unknown"):
        load_config(preset=name)


# -- for_backend -------------------------------------------------------------------------------------

SECTION = "search: {upper: 3.0}\nfor_backend:\n  ego: {search: {upper: 2.0}, repair: {spacing: 0.3}}\n"


def test_section_holds_for_its_backend_only(tmp_path):
    path = write(tmp_path, SECTION)
    assert load_config(file=path, backend="ego").search.upper == 2.0
    assert load_config(file=path, backend="casadi").search.upper == 3.0
    assert load_config(file=path, overrides=["backend=qptr"]).repair.spacing == Config().repair.spacing


def test_what_the_user_says_has_the_last_word(tmp_path):
    path = write(tmp_path, SECTION)
    config = load_config(file=path, overrides=["search.upper=1.0"])
    assert config.search.upper == 1.0
    assert config.repair.spacing == 0.3
    assert load_config(preset="scenario_1", overrides={"search.upper": None}).search.upper is None


def test_section_can_be_overridden_itself(tmp_path):
    path = write(tmp_path, SECTION)
    assert load_config(file=path, overrides=["for_backend.ego.search.upper=1.2"]).search.upper == 1.2


@pytest.mark.parametrize(
    "section, message",
    [
        ("ego: {serach: {upper: 1}}", "for_backend.*'serach'"),
        ("ego: {search: {upper: soon}}", "'search.upper'"),
        ("ego: 3", "for_backend"),
        ("ego: {search: {upper: -1}}", "'search.upper'"),
    ],
)
def test_bad_sections_are_named(tmp_path, section, message):
    with pytest.raises(ConfigError, match=message):
        load_config(file=write(tmp_path, f"for_backend:\n  {section}\n"))


@pytest.mark.parametrize("section", ["casadi: {serach: {upper: 1}}", "casadii: {search: {upper: 1}}"])
def test_sections_of_other_backends_are_left_alone(tmp_path, section):
    """They may be meant for a backend that a program registers, or that is not chosen."""
    assert load_config(file=write(tmp_path, f"for_backend:\n  {section}\n")) == Config()


def test_every_leaf_is_a_plain_value():
    """What a YAML file and result.json can hold."""

    def walk(node):
        for field in fields(node):
            value = getattr(node, field.name)
            if is_dataclass(value):
                walk(value)
            else:
                assert value is None or isinstance(value, bool | int | float | str | list | dict), field.name

    walk(Config())


# -- sections of backends ----------------------------------------------------------------------------


def test_every_backend_has_its_section():
    config = load_config(overrides=["casadi.rounds=3"], backend="casadi")
    assert config.section("casadi") is config.casadi
    assert config.section("casadi").rounds == 3
    for name in ("ego", "casadi", "qptr"):
        assert config.section(name) == getattr(config, name)
        assert name in backend_names()
    with pytest.raises(BackendError, match="'search' has no settings"):
        config.section("search")


def test_copies_keep_everything_and_share_nothing():
    config = load_config(overrides=["search.delta_t=0.1", "casadi.rounds=3"])
    for made in (copy.deepcopy(config), pickle.loads(pickle.dumps(config))):
        assert made == config
        assert type(made) is type(config)
        assert made.given == config.given == {"search.delta_t", "casadi.rounds"}
        made.search.delta_t = 0.7
        assert config.search.delta_t == 0.1
    assert replace(config, backend="casadi").casadi.rounds == 3


# -- keys without effect -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    "overrides, source",
    [
        ({"reference.obstacle_id": 7}, "planner"),
        ({"reference.obstacle_id": 7, "reference.source": "constant"}, "constant"),
        ({"reference.obstacle_id": 7, "reference.source": "file", "reference.file": "a.xml"}, "file"),
        ({"reference.file": "a.xml"}, "planner"),
        ({"reference.file": "a.xml", "reference.source": "recorded"}, "recorded"),
    ],
)
def test_what_names_something_that_is_not_looked_at_is_refused(overrides, source):
    key = "reference.obstacle_id" if "reference.obstacle_id" in overrides else "reference.file"
    with pytest.raises(ConfigError, match=f"'{key}' has no effect with reference.source={source}"):
        load_config(overrides=overrides)
    with pytest.raises(ConfigError, match=f"'{key}' has no effect"):
        load_config(overrides=[f"{name}={value}" for name, value in overrides.items()])


@pytest.mark.parametrize(
    "overrides",
    [
        ["reference.source=recorded", "reference.obstacle_id=7"],
        ["reference.source=file", "reference.file=a.xml"],
        ["reference.obstacle_id=null", "reference.file=null"],  # names nothing
    ],
)
def test_what_is_looked_at_is_accepted(overrides):
    load_config(overrides=overrides)


def test_what_a_file_sets_for_another_source_may_stand_there(tmp_path):
    """One file serves several sources; only what was said on purpose is judged."""
    path = write(tmp_path, "reference: {obstacle_id: 7, a_lat: 0.9}\n")
    config = load_config(file=path, overrides=["reference.source=constant"])
    assert config.reference.obstacle_id == 7
    assert list(config.without_effect()) == []


@pytest.mark.parametrize(
    "overrides, expected",
    [
        ([], []),
        (["search.delta_t=0.1", "ego.w_a=2"], []),
        (["driver=at_ttr", "search.delta_t=0.1"], [("search.delta_t", "driver", "at_ttr")]),
        (
            ["driver=at_ttr", "search.rule=scan", "search.upper=1", "search.time_limit=1"],
            [("search.rule", "driver", "at_ttr"), ("search.upper", "driver", "at_ttr")],
        ),
        (["casadi.rounds=3", "fallback=[]"], [("casadi.rounds", "backend", "ego")]),
        (["backend=casadi", "casadi.rounds=3"], []),
        (["backend=casadi", "ego.deform.smooth=3"], []),  # ego helps
        (["backend=shooting", "qptr.spacing=0.5"], [("qptr.spacing", "backend", "shooting")]),
        (["backend=qptr", "ego.deform.smooth=3"], []),  # it may have to find what qptr does not
        (["backend=qptr", "ego.deform.smooth=3", "fallback=[]"], [("ego.deform.smooth", "backend", "qptr")]),
        (["bound.nodes=9"], [("bound.nodes", "bound.wanted", "False")]),
        (["bound.nodes=9", "mitigation.wanted=true"], []),  # which asks for the bound of the vehicle
        (["bound.nodes=9", "explain.wanted=true"], []),
        (["bound.nodes=9", "backend=portfolio", "portfolio.bound=true"], []),
        (
            ["bound.kinds=[search]", "mitigation.wanted=true"],
            [("bound.kinds", "bound.wanted", "False")],
        ),
        (["ego.precondition=false"], [("ego.precondition", "ego.solver", "newton")]),
        (["ego.precondition=false", "ego.solver=lbfgs"], []),
        (
            ["reference.source=constant", "reference.a_lat=0.9"],
            [("reference.a_lat", "reference.source", "constant")],
        ),
        (["reference.a_lat=0.9"], []),
    ],
)
def test_other_keys_without_effect_are_told(overrides, expected):
    assert list(load_config(overrides=overrides).without_effect()) == expected


def test_defaults_are_never_without_effect():
    """A preset sets what it likes: nobody said it on purpose."""
    for name in preset_names():
        for backend in ("ego", "casadi", "qptr"):
            assert list(load_config(preset=name, backend=backend).without_effect()) == []
