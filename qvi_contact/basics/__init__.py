"""What every room uses: checks of input, units, writing of files, the terminal."""
