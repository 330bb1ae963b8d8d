"""From trial files to models, figures and the report."""
