"""A folder of CommonRoad scenarios, judged by what is not ours: ``python -m tests.corpus FOLDER``."""
