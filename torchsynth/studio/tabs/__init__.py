"""The tabs of the page: each holds what it alone needs, and shows what it makes on the stage."""
