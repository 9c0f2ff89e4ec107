"""Contact problems as wild as users may make them, what becomes of each, and whether what is called solved is true."""
