"""Measures of images: image difference functions, catchments and place recognition, of worlds and image databases."""
