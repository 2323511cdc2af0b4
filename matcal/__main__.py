from matcal.cli.main import main

main()
