"""What every method uses: types, files, the words for how a solve ended."""
