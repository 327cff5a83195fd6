"""The configuration: defaults, layers, and an error with a name for everything that is wrong."""

from __future__ import annotations

from dataclasses import asdict, fields, is_dataclass

import pytest
import yaml

from repair.config import CHOICES, RANGES, Config, load_config, preset_names
from repair.errors import ConfigError, RepairError
from repair.scene import settings as module


def value_of(config, key):
    for part in key.split("."):
        config = getattr(config, part)
    return config


def test_defaults_are_the_dataclasses():
    assert load_config() == Config()
    assert isinstance(load_config(), Config)


def test_two_loads_share_nothing():
    first, second = load_config(), load_config()
    first.ego.deform.smooth = 77.0
    assert second.ego.deform.smooth != 77.0
    assert load_config() == Config()


def test_every_choice_and_range_names_an_existing_key_and_holds_its_default():
    for key, choices in CHOICES.items():
        assert value_of(Config(), key) in choices, key
    for key, (low, high) in RANGES.items():
        default = value_of(Config(), key)
        assert default is None or low <= default <= high, key


@pytest.mark.parametrize("key", sorted(CHOICES))
def test_every_choice_is_accepted_and_another_word_refused(key):
    for word in CHOICES[key]:
        assert value_of(load_config(overrides=[f"{key}={word}"]), key) == word
    with pytest.raises(ConfigError, match=f"'{key}'.*nonsense.*{CHOICES[key][0]}"):
        load_config(overrides=[f"{key}=nonsense"])


@pytest.mark.parametrize("key", sorted(RANGES))
def test_every_range_is_closed(key):
    low, high = RANGES[key]
    kind = type(value_of(Config(), key))
    for value in (low, high):
        shown = int(value) if kind is int else value
        assert value_of(load_config(overrides={key: shown}), key) == pytest.approx(value)
    for value in (low - 1, high + 1):
        shown = int(value) if kind is int else value
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
    assert load_config(overrides=["seed=1", "seed=2"]).seed == 2


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
        ("search.upper=inf", "'search.upper'.*finite"),
        ("repair.degree=3.5", "'repair.degree'"),
        ("repair.degree=2", "'repair.degree'"),
        ("ego.precondition=maybe", "'ego.precondition'"),
        ("search=3", "'search'"),
        ("search.delta_t.x=3", "search.delta_t"),
        ("backend=[1,2]", "backend"),
        ("seed={a: 1}", "seed"),
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
    path = write(tmp_path, yaml.safe_dump(asdict(config)))
    assert load_config(file=path) == config


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


def test_schema_is_documented_field_by_field_types():
    """Every leaf is a plain value: what a YAML file and result.json can hold."""

    def walk(node):
        for field in fields(node):
            value = getattr(node, field.name)
            if is_dataclass(value):
                walk(value)
            else:
                assert value is None or isinstance(value, bool | int | float | str | list | dict), field.name

    walk(Config())
    assert module.__doc__
