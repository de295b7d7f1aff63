"""The pictures of the thesis, laid out as the thesis lays them out."""
