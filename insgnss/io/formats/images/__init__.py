"""Position and attitude inside the images: Exif, XMP, JPEG and TIFF structures."""
