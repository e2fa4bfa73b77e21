"""What goes beyond the source's reduced-order model, with numbers on recordings that the models have not seen.

``python -m studies.beyond_the_source {memory,frequencies,intervals} FOLDER RESULTS`` trains the models, keeps
them in RESULTS, and prints a table. FOLDER is raw_data/numerical_tank.
"""
