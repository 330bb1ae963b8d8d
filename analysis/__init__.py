"""From trial files to models, figures and the report; touches no device.

`data` loads and prepares samples, `tustin` and `gp` are the two families of models,
`study` fits and cross-validates them, `findings` computes what the report shows,
`figures` and `report` draw and print it. Begin with `data`, then `study`.
"""
