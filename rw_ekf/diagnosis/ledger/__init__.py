"""The hypotheses about a record: weighed, grown, chosen."""
