"""The guide: a page that explains published and consistent covariances, made from measurements.

`make guide` simulates, measures, draws and writes static/guide.html, which the server shows at /guide. It is a
document, made anew when the code changes, and no part of the installed library.
"""
