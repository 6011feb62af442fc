"""What an identification found, for readers: text, JSON, HTML, figures, a folder.

Everything is made from the records of `pushfit.fit.results`; nothing here fits.
"""
