"""The command `surrogate`, also as `python -m surrogate`."""

from touchcal.signals import silent_interrupt


def main() -> None:
    """Entry point."""
    with silent_interrupt():
        from surrogate.cli.main import main as command
    command()


if __name__ == "__main__":
    main()
