"""How long, how stiff and how extreme a rod may be: the program `python -m scripts.stability`, in parts."""
