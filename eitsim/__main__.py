"""The command `eitsim`, also as `python -m eitsim`."""

from touchcal.signals import silent_interrupt


def main() -> None:
    """Entry point."""
    with silent_interrupt():
        from eitsim.cli.main import main as command
    command()


if __name__ == "__main__":
    main()
