"""The scenarios, by subject; `ALL` in `registry` lists them."""
