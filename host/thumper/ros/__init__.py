"""The product's border: its data as standard ROS 2 messages, for the bus, recordings and other programs."""
