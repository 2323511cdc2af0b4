from eitsim.cli import main

main()
