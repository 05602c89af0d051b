"""The log layer: every log in (CSV, Parquet, MATLAB, foreign ones through a column map), every log out.

bytes -> RawTable (csv_table, parquet_table, matlab_table, foreign) -> column map -> row rules -> WheelLog -> tables
and writers.
"""
