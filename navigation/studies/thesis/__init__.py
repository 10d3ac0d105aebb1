"""The studies of the thesis: functions from views to tables and numbers. Figures and the report follow from these alone."""
