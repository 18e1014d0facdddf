"""What an HTML page is made of; knows no fit and no study."""
