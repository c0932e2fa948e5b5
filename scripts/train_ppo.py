"""Train PPO: `python -m scripts.train_ppo --help`. The same command as `python -m agents.ppo`."""

from agents.ppo import main

if __name__ == "__main__":
    main(__doc__)
