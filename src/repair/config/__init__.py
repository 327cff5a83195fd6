"""The configuration: one schema, presets, overrides."""

from repair.config.load import load_config, preset_names
from repair.config.schema import Config

__all__ = ["Config", "load_config", "preset_names"]
