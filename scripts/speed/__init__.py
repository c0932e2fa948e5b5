"""How fast it is: the program `python -m scripts.bench`, in parts."""
