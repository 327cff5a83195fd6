"""Seeded mutation fuzzer: damaged scenario, configuration and solution files through the whole pipeline."""
