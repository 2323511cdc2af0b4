from matcal.cli import main

main()
