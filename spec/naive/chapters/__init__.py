"""The shared chapters of the specification (1 to 9, 11 and 16); those of the methods are in `methods`."""
