"""What the expert shows: demonstrations, their files, and the scripted experts."""
