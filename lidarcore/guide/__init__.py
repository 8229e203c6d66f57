"""The guide: a page that explains published against consistent covariance, made from measurements.

`python -m lidarcore.guide static/guide.html` (or `make guide`) simulates, measures, draws and writes it. It is no
`lidarcore experiment`: that is for users and any recording; this page is shipped, and made anew when the code changes.
"""
