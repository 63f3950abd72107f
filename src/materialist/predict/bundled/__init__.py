"""The bundled network: a small convolutional one, trained on generated pictures, whose weights ship in the package."""
