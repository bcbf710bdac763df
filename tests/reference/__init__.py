"""Naive references: one file for each paper, written from the paper alone, one pixel at a time.

The library never imports them; the tests hold it to them.
"""
