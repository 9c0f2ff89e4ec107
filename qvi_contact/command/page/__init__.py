"""One page that says what came out: a person can file it, mail it, and open it anywhere."""
