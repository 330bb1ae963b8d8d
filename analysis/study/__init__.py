"""Models of a study: fitted by name, cross-validated, scored, resumed.

`models` names the fitters, `crossval` is ten-fold cross-validation trial by trial,
`jobs` runs tasks on processes or a cluster, `study` joins them. Begin with `study`.
"""
