"""Train PPO: `python -m scripts.train_ppo --help`. The same command as `python -m agents.ppo`."""

import tyro

from agents.ppo import Args, train


def main() -> None:
    """Read the arguments and train."""
    train(tyro.cli(Args, description=__doc__))


if __name__ == "__main__":
    main()
