"""The static page; a package so that its files are installed with the program."""
