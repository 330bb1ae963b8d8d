"""Models of a study: fitted by name, cross-validated, scored, resumed.

Begin with `study`, which joins them; `models` names the fitters, `crossval` is ten-fold
cross-validation trial by trial, `jobs` runs tasks on processes or a cluster,
`break_away_fit` and `slip_risk` say what the ground gives before a foot at rest slips.
"""
