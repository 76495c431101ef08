"""HTTP below the routes: limits, middleware, errors as problem details, shared response helpers, event streams."""
