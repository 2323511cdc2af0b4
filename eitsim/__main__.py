from eitsim.cli.main import main

main()
