"""External loads of a rod, one file each; ``hub.py`` is where the kernels meet them."""
