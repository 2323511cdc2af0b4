"""The command `matcal`, also as `python -m matcal`."""

from touchcal.signals import silent_interrupt


def main() -> None:
    """Entry point."""
    with silent_interrupt():
        from matcal.cli.main import main as command
    command()


if __name__ == "__main__":
    main()
