"""Whether `tolerance` keeps its promise: the program `python -m scripts.tolerance`, in parts."""
