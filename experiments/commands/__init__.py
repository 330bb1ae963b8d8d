"""Commands, one module each: arguments, examples, `run`.

Slow imports are inside `run`, so that `--help` answers at once; `live` is the second
screen of `watch` and `replay`. The table of commands is in `experiments.__main__`.
"""
