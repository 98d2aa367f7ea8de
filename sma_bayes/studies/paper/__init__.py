"""The paper, table by table and claim by claim: what it prints beside what comes out."""
