"""HTTP code below the routes: limits, middleware, errors as problem documents, response helpers, event streams."""
