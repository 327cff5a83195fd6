"""``python -m benchmarks``: everything measured, in its own process, on one BLAS thread."""

import os
import sys

if __name__ == "__main__":
    # Before NumPy is loaded: more threads slow small dense algebra down, and disturb what is measured.
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"
    os.environ["MPLBACKEND"] = "Agg"
    from benchmarks.run import main

    sys.exit(main())
