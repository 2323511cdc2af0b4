from surrogate.cli.main import main

main()
