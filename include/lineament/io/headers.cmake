set(headers )
