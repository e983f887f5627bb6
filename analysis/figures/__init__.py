"""Pictures; what a stand-in made says so on the picture itself."""
