"""Where nothing avoids the conflict: the motion that hits least hard."""
