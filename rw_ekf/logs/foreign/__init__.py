"""Log formats of other programs, one file each, behind the registry in `rw_ekf.logs.formats`.

Each is read through a library that is an optional extra and is imported only when such a file is read.
"""
