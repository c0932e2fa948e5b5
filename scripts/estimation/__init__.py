"""Twin experiments with the estimators: the program `python -m scripts.estimate`, in parts."""
