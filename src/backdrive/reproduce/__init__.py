"""Run the thesis' experiments, draw them, bind the book."""
