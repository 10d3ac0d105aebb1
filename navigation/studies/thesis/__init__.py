"""The studies of the thesis, as functions from panoramas to tables; pictures and the report are drawn from the tables alone."""
