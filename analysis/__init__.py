"""From trial files to models, figures and the report. For notebooks: `analysis.api`."""
