"""Where contact is enforced: penalty, friction, stick springs."""
