"""Systems of other papers, as far as they are no retriever over the forest."""
