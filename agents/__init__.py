"""Controllers for the environments; run from the root of a checkout, for instance `python -m agents.ppo`."""
