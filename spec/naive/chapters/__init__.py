"""The specification, a module for each chapter; each method is one module and one line in `methods`."""
