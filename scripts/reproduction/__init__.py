"""The paper's experiments as simulations: the program `python -m scripts.reproduce_paper`, in parts."""
