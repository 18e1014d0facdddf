"""What a fit holds, says, draws and keeps."""
