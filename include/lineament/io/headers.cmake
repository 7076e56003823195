set(headers
    file.hpp
    model_file.hpp
    safetensors.hpp
)
