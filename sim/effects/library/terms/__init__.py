"""Effects that are terms of a model of a vehicle: for models that leave a term out, or describe it wrongly."""
